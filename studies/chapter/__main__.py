from studies.chapter.study import main

main()
