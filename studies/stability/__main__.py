from studies.stability.study import main

main()
